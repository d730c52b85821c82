"""Search: which effects explain the recordings, grown stepwise, exchanged and pruned by one score."""
