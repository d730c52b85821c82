"""What a core starts from: one module for each templates_c/board/startup_<name>.c, with its `check`."""
