"""Stage: a region in the sweep frame to slices, cells, the Reeb graph and the dual graph."""
