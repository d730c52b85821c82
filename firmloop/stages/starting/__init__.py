"""The stage before a project is there: what recordings alone tell of columns, plant and ranges."""
