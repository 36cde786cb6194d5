"""From wheels and depths to motion: where the robot is, what stands around it, how it drives on."""
