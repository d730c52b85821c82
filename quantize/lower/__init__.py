"""Lower: from a Law's graph to a Program's operations, with bounds proven as they go."""
