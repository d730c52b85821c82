"""Plant in, real-valued law out."""
