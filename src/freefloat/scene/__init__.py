"""What is seen of motions and maps, as MeshCat commands."""
