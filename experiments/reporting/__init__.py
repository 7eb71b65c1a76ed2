"""What people look at: figures, pages, tables, words.

`figures` draws with matplotlib in the look of `styles`, `tables` writes numbers, `words` makes
sentences, `terminal` makes tables for page and terminal, `page` puts all of it into HTML that needs
no network. Out go the reports `run` and `study`, and the page of a comparison.
"""
