"""The ground station: a gateway from Zenoh to browsers, and the page that it serves."""
