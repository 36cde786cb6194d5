"""The live page: a drive as it happens, in a browser, with a STOP that does not wait for the loop."""
