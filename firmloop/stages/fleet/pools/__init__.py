"""Pools: where the recordings of a fleet are diagnosed: processes of this machine, Dask, Ray; one file each."""
