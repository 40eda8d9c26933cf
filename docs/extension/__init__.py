"""What the site needs beyond Sphinx and well-kept extensions; each module says in its second sentence why it is none of these."""
