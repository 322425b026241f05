"""The technician's page: static files that the daemon itself serves, and nothing from elsewhere."""
