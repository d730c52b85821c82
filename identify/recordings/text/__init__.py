"""Text files: how columns, words, dates, thousands and objects are written in them."""
