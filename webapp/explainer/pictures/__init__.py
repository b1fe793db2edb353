"""Views for people: as pictures, and as words that state the same facts."""
