"""Create reports with figures, tables and sentences as HTML pages.

The module `figures` draws figures with matplotlib, in the styles that the module `styles` defines.
The module `tables` formats numbers, and `terminal` creates the main tables of a run. The module
`words` writes the sentences in a report. The module `page` combines figures, tables and sentences
into an HTML page that needs no network. The modules `run` and `study` write the reports of
benchmarks and studies.
"""
