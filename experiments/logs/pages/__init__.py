"""What people look at: the pages of an import, an identification, a tracked log, and a trend."""
