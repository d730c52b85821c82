"""Controller: the recorded controller replayed on its own inputs, and the faults that explain its command."""
