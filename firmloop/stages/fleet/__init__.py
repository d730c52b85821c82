"""Fleet: the recordings of many machines of one type, each diagnosed on its own and compared with the others."""
