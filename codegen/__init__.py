"""Program in, text out."""
