// Read by a test of src/foam and by benches/foam.rs: the network of a periodic flat foam in a Surface Evolver dump of the
// string model (`../shared/fe/foams/flat2d_*.fe`), whose faces are rings of signed edges.

/// The network of the foam in `text` on a flat torus with the given periods; `None` if the text is no such dump.
fn flat_network(text: &str, periods: [f64; 2]) -> Option<Network> {
    let vertices: BTreeMap<usize, DVec3> = section(text, "vertices", "edges")
        .filter_map(|row| {
            let mut words = row.split_whitespace();
            let id = words.next()?.parse().ok()?;
            Some((id, DVec3::new(words.next()?.parse().ok()?, words.next()?.parse().ok()?, 0.0)))
        })
        .collect();
    let edges: BTreeMap<i64, [usize; 2]> = section(text, "edges", "faces")
        .filter_map(|row| {
            let mut words = row.split_whitespace();
            let id = words.next()?.parse().ok()?;
            Some((id, [words.next()?.parse().ok()?, words.next()?.parse().ok()?]))
        })
        .collect();
    let wraps: BTreeMap<i64, IVec3> = section(text, "edges", "faces")
        .filter_map(|row| {
            let mut words = row.split_whitespace();
            let id = words.next()?.parse().ok()?;
            let mut wrap = words.skip(2).map(|word| match word {
                "+" => 1,
                "-" => -1,
                _ => 0,
            });
            Some((id, IVec3::new(wrap.next()?, wrap.next()?, 0)))
        })
        .collect();
    let faces: Vec<Vec<i64>> = section(text, "faces", "bodies")
        .map(|row| {
            let ring = row.split("/*").next().unwrap_or_default();
            ring.split_whitespace().skip(1).filter_map(|word| word.parse().ok()).collect::<Vec<i64>>()
        })
        .filter(|face| face.len() > 2)
        .collect();
    let mut beside: BTreeMap<i64, usize> = BTreeMap::new();
    for (face, ring) in faces.iter().enumerate() {
        beside.extend(ring.iter().map(|&edge| (edge, face)));
    }
    let number: BTreeMap<usize, VertexId> =
        vertices.keys().enumerate().map(|(at, &id)| (id, VertexId::from_index(at))).collect();
    let mut cells = IndexVec::new();
    for ring in &faces {
        let mut shift = IVec3::ZERO;
        let mut corners = Vec::new();
        let mut centre = DVec3::ZERO;
        for &edge in ring {
            let [tail, head] = *edges.get(&edge.abs())?;
            let wrap = *wraps.get(&edge.abs())?;
            let (start, step) = if edge > 0 { (tail, wrap) } else { (head, -wrap) };
            let place = vertices.get(&start)?;
            centre += *place + DVec3::new(periods[0], periods[1], 0.0) * shift.as_dvec3();
            let neighbour = CellId::from_index(*beside.get(&-edge)?);
            corners.push(RingCorner { vertex: *number.get(&start)?, shift, neighbour });
            shift += step;
        }
        let count = f64::from(u32::try_from(corners.len()).ok()?);
        cells.push(CellRing { centre: centre / count, corners });
    }
    let places = vertices.values().copied().collect();
    Network::new(Period([Some(periods[0]), Some(periods[1]), None]), 0, &places, &cells).ok()
}

/// The rows between the lines that start with two words; a backslash continues a row.
fn section(text: &str, from: &str, to: &str) -> impl Iterator<Item = String> {
    let titled = |line: &&str, title: &str| line.split_whitespace().next() == Some(title);
    let joined: String = text
        .lines()
        .skip_while(|line| !titled(line, from))
        .skip(1)
        .take_while(|line| !titled(line, to))
        .map(|line| line.strip_suffix('\\').map_or_else(|| format!("{line}\n"), str::to_owned))
        .collect();
    joined.lines().map(str::to_owned).collect::<Vec<_>>().into_iter()
}
