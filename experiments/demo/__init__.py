"""The live axis: a session without a screen, a page in the browser, a recorder for lectures."""
