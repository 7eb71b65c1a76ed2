"""Create HTML reports with figures, tables and sentences.

The module `figures` draws figures with matplotlib, in the styles that the module `styles` defines.
The module `tables` formats numbers, and `terminal` creates the main tables of a run. The module
`sentences` writes the sentences in a report. The module `page` combines figures, tables and
sentences into an HTML page that needs no network connection. The module `run` writes the report of
a benchmark, and the module `study` writes the report of a study.
"""
