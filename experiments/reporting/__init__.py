"""What people look at: pages, figures, tables, words.

`charts` and `tables` are what is to be shown, as data; `drawing` makes SVG of it and `figures`
matplotlib, `page` a page that needs no network, `terminal` text; `styles` gives each estimator its
colour. In come pooled rows and curves, out go pages and text; `run` and `study` are two reports.
"""
