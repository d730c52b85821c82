"""Links: one file each way to reach a controller, and what they share; those with a LINK open an emulator."""
