"""From recorded movement to a head: where points lie on it, and the weights that follow them."""
