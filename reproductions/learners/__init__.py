"""Standard learners, compared with classic controllers and clairvoyant bounds."""
