"""Planar arms: exact ranges of headings."""
