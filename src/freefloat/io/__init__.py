"""Files: scenarios, plans, maps, exports."""
