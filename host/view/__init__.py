"""What people look at: pictures of the net, its depths and the way driven."""
