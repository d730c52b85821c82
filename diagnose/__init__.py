"""Recordings and a plant in, a finding out: where simulation and bench differ, and what physics was left out."""
