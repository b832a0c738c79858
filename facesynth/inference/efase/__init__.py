"""eFASE: the cheapest path through recorded motion nodes, and the motion that it makes."""
