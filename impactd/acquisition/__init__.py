"""From a request to a record: one transition table and the service that executes it."""
