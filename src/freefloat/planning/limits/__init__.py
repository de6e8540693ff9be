"""Motions that keep limits: screened, tried, searched for further, stretched."""
