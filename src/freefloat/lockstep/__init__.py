"""Numbers of eight motions in lanes of a processor; knows no robot."""
