"""Scope: the page in a browser that shows a running controller and sets its parameters."""
