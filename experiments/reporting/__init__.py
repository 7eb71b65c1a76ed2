"""What people look at: figures, pages, tables, words.

`figures` draws with matplotlib in the look of `styles`, `tables` writes numbers, `words` makes
sentences, `page` puts all of it into HTML that needs no network, `terminal` prints. In come the
rows and traces that `inputs` obtains; out go the reports `run`, `study` and `compare`. The pages of
logs and the demo still draw with `charts_old`.
"""
