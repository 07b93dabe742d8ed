"""The estimate of a held contact improves with time; a sliding contact is tracked."""
