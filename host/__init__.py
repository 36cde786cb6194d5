"""The robot's host side: camera, net, depth, navigation, link, simulation."""
