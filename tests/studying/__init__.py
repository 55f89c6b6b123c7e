"""Laws of studies: an inverse is judged on data not fitted, and a loop is closed on the rig recorded."""
