// The map of a phone: its recorded frames as points, its nodes as curves.

export async function begin() {}
