"""What people read: numbers with their uncertainty, the same on the terminal and in reports."""
