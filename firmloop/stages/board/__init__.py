"""Board: what this machine has, and what is flashed and watched."""
