"""Presentation: results in words, JSON, figures and pages."""
