"""Answers for machines and tables for people."""
