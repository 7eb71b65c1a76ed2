"""The charts of the pages of logs and of the demo; everything else draws with `figures`."""
