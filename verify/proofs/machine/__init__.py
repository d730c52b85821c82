"""Prove machine code equal to the operations of a proof.json: terms, what the code computes, and the comparison."""
