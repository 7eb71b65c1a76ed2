"""What people look at: the pages of an import, an identification, a tracked log, and a trend.

In come what `importing`, `identification`, `track` and `trend` found; out go text, JSON and a page
(`page`), from the same sentences.
"""
