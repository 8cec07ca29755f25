"""The study of the paper, done again: maps, readings, tables, figures."""
