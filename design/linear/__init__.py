"""Linear laws: how far their state reaches, and how they are written as a Law."""
