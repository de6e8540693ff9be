"""The wish: a path, how it is timed, what is looked for."""
