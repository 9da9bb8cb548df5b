"""The live page: meshcat's server, and a page that shows frames while they are computed."""
