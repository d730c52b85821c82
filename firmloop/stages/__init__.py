"""Stages: the walk from recording to verdict, one function a stage."""
