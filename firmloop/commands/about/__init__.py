"""Commands that tell what firmloop and this machine have, and read no project."""
