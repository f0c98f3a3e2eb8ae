"""Check of the language: private words that may not stand in docs, docstrings, comments and messages."""
