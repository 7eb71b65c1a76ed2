"""Reports: figures, tables, sentences and HTML pages.

`figures` draws figures with matplotlib, in the styles that `styles` defines. `tables` formats
numbers, `words` writes sentences, and `terminal` makes tables for pages and the terminal. `page`
combines figures, tables and sentences into an HTML page that needs no network. `run` and `study`
write the reports of a run and of a study.
"""
