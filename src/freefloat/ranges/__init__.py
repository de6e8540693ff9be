"""Exact ranges of headings, and the same condition in space: touch points."""
