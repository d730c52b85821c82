"""Model: a hypothesis of nominal plant and effects, its likelihood, its fit and its intervals."""
