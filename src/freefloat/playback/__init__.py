"""Scenes as a page: in one file, on loopback, as pictures and videos."""
