"""Project: one TOML file, read strictly and written back."""
