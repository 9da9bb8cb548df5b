"""From contacts, joints and forces to impulses."""
