"""A local web application: edit a scenario and see at once from which attitudes it is feasible."""
