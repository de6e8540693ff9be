"""All attitudes: very many motions, maps, the best and the nearest."""
