"""Search for paths of recorded pieces, as torch tensors on any device: the cheapest path, and the mean over all paths.

A search runs over positions (phones, or pictures) with candidates at each. `targets` say what a candidate costs where it
stands, a `Steps` what it costs to go from one to another. Steps are made when they are asked for, a block of next
candidates against all previous ones at a time, by matrix products; memory grows with the number of candidates, never with
its square. `cheapest` and `posterior` are the two recursions; `motion_nodes`, `jumps` and `pictures` the steps of eFASE, of
the anime graph and of the speaker's pictures; `pruning` leaves out most of a database before the recursion starts.
"""
