"""The tool: project file, command line, report."""
