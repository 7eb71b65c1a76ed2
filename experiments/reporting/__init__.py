"""Reports: figures, tables, sentences and HTML pages.

`figures` draws with matplotlib in the styles of `styles`, `tables` formats numbers, `words` writes
sentences, and `terminal` makes tables for pages and the terminal. `page` combines them into HTML
that needs no network. `run` and `study` write the reports of a run and of a study.
"""
